# SPDX-License-Identifier: GPL-3.0-or-later
"""Walking a shader node graph as if groups, reroutes and muted nodes were not there.

Blender 5 can flatten a tree itself (`inline_shader_nodes`); 4.5 cannot, so both versions are walked the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

Node = Any
"""A shader node. Which properties it has depends on `bl_idname`, which type checkers cannot follow; so with sockets."""
Socket = Any
Groups = tuple[Node, ...]
"""Group nodes entered on the way to a node, outermost first."""


@dataclass(frozen=True)
class Source:
    """What drives an input: an output of a real node, or, with `node` None, the value of an unlinked `socket`.

    `groups` are the group nodes entered on the way, outermost first.
    """

    node: Node
    socket: Socket
    groups: Groups

    @property
    def key(self) -> tuple[object, ...]:
        """Tells this output of this node, entered through these groups, from all others of the tree."""
        return self.node.as_pointer(), self.socket.identifier, *(group.as_pointer() for group in self.groups)


def find_source(socket: Socket, groups: Groups) -> Source:
    """What drives the input `socket` of a node inside `groups`."""
    while True:
        link: Any = _used_link(socket)
        if link is None:
            return Source(None, socket, groups)
        output, node = link.from_socket, link.from_node
        if node.mute and node.type != "REROUTE":
            bypass = next((inner.from_socket for inner in node.internal_links if inner.to_socket == output), None)
            if bypass is None:
                return Source(node, output, groups)
            socket = bypass
        elif node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.type == "GROUP" and (inner := _group_result(node, output.identifier)) is not None:
            socket, groups = inner, (*groups, node)
        elif node.type == "GROUP_INPUT" and groups:
            socket = next(entry for entry in groups[-1].inputs if entry.identifier == output.identifier)
            groups = groups[:-1]
        else:
            return Source(node, output, groups)


def has_nodes(data_block: Any) -> bool:
    """Whether a node graph defines a material, world or light. From 5.0 on that is always so where there is one, and
    asking for `use_nodes` is deprecated."""
    if data_block.node_tree is None:
        return False
    return bpy.app.version >= (5, 0, 0) or data_block.use_nodes


def find_output(tree: Any, kind: str) -> Node | None:
    """The active output node of type `kind` that Cycles would use: made for Cycles, else for all renderers."""
    outputs = [node for node in tree.nodes if node.bl_idname == kind and not node.mute]
    for target in ("CYCLES", "ALL", "EEVEE"):
        candidates = [node for node in outputs if node.target == target]
        if candidates:
            return next((node for node in candidates if node.is_active_output), candidates[0])
    return None


def _used_link(socket: Socket) -> bpy.types.NodeLink | None:
    if not socket.is_linked:
        return None
    return next((link for link in socket.links if link.is_valid and not link.is_muted), None)


def _group_result(node: Node, identifier: str) -> Socket | None:
    if node.node_tree is None:
        return None
    outputs = [inner for inner in node.node_tree.nodes if inner.type == "GROUP_OUTPUT"]
    output = next((inner for inner in outputs if inner.is_active_output), None)
    if output is None:
        return None
    return next((entry for entry in output.inputs if entry.identifier == identifier), None)
