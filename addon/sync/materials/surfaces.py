# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader closures of a node graph, blended into one set of Principled constants.

Whatever a shader node asks for that such a set cannot hold is reported, with the node's name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import add

from ...scene.arrays import Color
from .expressions import Evaluator, Expression, grey
from .graph import Groups, Node, Socket, Source, find_source
from .operations import WHITE, as_value, luminance, per_channel, reflectance, unit

BLACK: Color = (0.0, 0.0, 0.0)
NOTHING = Expression(BLACK)
EVERYTHING = Expression(WHITE)


@dataclass(frozen=True)
class Surface:
    """Principled constants; `alpha` may read a texture, as may `base_color`. `weight` 0…1 is the share that
    reflects at all (an emission shader has none), used when surfaces are mixed."""

    base_color: Expression = NOTHING
    metallic: float = 0.0
    roughness: float = 0.5
    diffuse_roughness: float = 0.0
    specular: float = 0.0
    emission: Color = BLACK
    alpha: Expression = EVERYTHING
    weight: float = 1.0


def evaluate_surface(socket: Socket, groups: Groups, evaluator: Evaluator) -> Surface:
    """The surface that a shader input receives; black where nothing is connected, as in Cycles."""
    source = find_source(socket, groups)
    if source.node is None or source.node.mute:
        return Surface(weight=0.0)
    return evaluator.once(source, _read, Surface(weight=0.0))


def _read(source: Source, evaluator: Evaluator) -> Surface:
    reader = _READERS.get(source.node.bl_idname)
    if reader is None:
        evaluator.warn(source.node, f"{source.node.bl_label} is not rendered yet; a diffuse surface is shown instead")
        reader = _unknown
    surface = reader(source, evaluator)
    return replace(surface, emission=evaluator.limited(surface.emission, source.node))


class _Inputs:
    """The inputs of one shader node by name, evaluated."""

    def __init__(self, source: Source, evaluator: Evaluator) -> None:
        self.node = source.node
        self._groups = source.groups
        self._evaluator = evaluator

    def expression(self, name: str) -> Expression:
        return self._evaluator.expression(self.node.inputs[name], self._groups)

    def color(self, name: str) -> Color:
        return self._evaluator.color(self.node.inputs[name], self._groups)

    def value(self, name: str) -> float:
        return self._evaluator.value(self.node.inputs[name], self._groups)

    def unit(self, name: str) -> float:
        return unit(self.value(name))

    def roughness(self) -> float:
        return self.unit("Roughness")

    def is_used(self, name: str) -> bool:
        """Whether an input exists and is linked or not zero."""
        socket = self.node.inputs.get(name)
        if socket is None:
            return False
        source = find_source(socket, self._groups)
        return source.node is not None or bool(getattr(source.socket, "default_value", 0.0))

    def is_linked(self, name: str) -> bool:
        socket = self.node.inputs.get(name)
        return socket is not None and find_source(socket, self._groups).node is not None

    def warn_used(self, **features: str) -> None:
        """Report each feature (its words, by input name with underscores) whose input is used."""
        for name, words in features.items():
            if self.is_used(name.replace("_", " ")):
                self._evaluator.warn(self.node, f"{words} not rendered yet")

    def warn_normal(self) -> None:
        if self.is_linked("Normal"):
            self._evaluator.warn(self.node, "normal and bump maps are not rendered yet; the mesh's own normal is used")


def _principled(source: Source, evaluator: Evaluator) -> Surface:
    inputs = _Inputs(source, evaluator)
    inputs.warn_normal()
    inputs.warn_used(
        Subsurface_Weight="subsurface scattering is",
        Coat_Weight="the coat is",
        Sheen_Weight="sheen is",
        Thin_Film_Thickness="thin film is",
    )
    metallic = inputs.unit("Metallic")
    if inputs.is_used("Anisotropic") and (metallic > 0.0 or inputs.value("Specular IOR Level") > 0.0):
        evaluator.warn(inputs.node, "anisotropy is not rendered yet")
    tint = inputs.color("Specular Tint")
    if tint != WHITE:
        evaluator.warn(inputs.node, "the specular tint is rendered as grey")
    base_color = inputs.expression("Base Color")
    if inputs.is_used("Transmission Weight"):
        transmission = inputs.unit("Transmission Weight")
        if transmission > 0.0 and metallic < 1.0:
            evaluator.warn(inputs.node, "transmission is not rendered yet; the surface is shown opaque and dark")
            base_color = base_color.scaled(1.0 - transmission * (1.0 - metallic))
    specular = reflectance(inputs.value("IOR")) * 2.0 * inputs.value("Specular IOR Level") * luminance(tint)
    return Surface(
        base_color=base_color,
        metallic=metallic,
        roughness=inputs.roughness(),
        diffuse_roughness=inputs.unit("Diffuse Roughness"),
        specular=unit(specular),
        emission=_emitted(inputs, "Emission Color", "Emission Strength"),
        alpha=inputs.expression("Alpha"),
    )


def _emitted(inputs: _Inputs, color: str, strength: str) -> Color:
    if not inputs.is_used(strength):
        return BLACK
    factor = inputs.value(strength)
    return BLACK if factor == 0.0 else per_channel(lambda channel: channel * factor, inputs.color(color))


def _diffuse(source: Source, evaluator: Evaluator) -> Surface:
    inputs = _Inputs(source, evaluator)
    inputs.warn_normal()
    return Surface(base_color=inputs.expression("Color"), diffuse_roughness=inputs.roughness())


def _like_diffuse(source: Source, evaluator: Evaluator) -> Surface:
    inputs = _Inputs(source, evaluator)
    evaluator.warn(inputs.node, f"{inputs.node.bl_label} is rendered as a diffuse surface")
    inputs.warn_normal()
    return Surface(base_color=inputs.expression("Color"))


def _glossy(source: Source, evaluator: Evaluator) -> Surface:
    inputs = _Inputs(source, evaluator)
    inputs.warn_normal()
    inputs.warn_used(Anisotropy="anisotropy is")
    name = "Color" if "Color" in inputs.node.inputs else "Base Color"
    return Surface(base_color=inputs.expression(name), metallic=1.0, roughness=inputs.roughness())


def _glass(source: Source, evaluator: Evaluator) -> Surface:
    inputs = _Inputs(source, evaluator)
    inputs.warn_normal()
    evaluator.warn(inputs.node, "transmission is not rendered yet; the surface is shown opaque and dark")
    reflects = inputs.node.bl_idname == "ShaderNodeBsdfGlass"
    specular = reflectance(inputs.value("IOR")) if reflects else 0.0
    return Surface(roughness=inputs.roughness(), specular=min(specular, 1.0))


def _specular(source: Source, evaluator: Evaluator) -> Surface:
    inputs = _Inputs(source, evaluator)
    inputs.warn_normal()
    inputs.warn_used(Clear_Coat="the coat is")
    return Surface(
        base_color=inputs.expression("Base Color"),
        roughness=inputs.roughness(),
        specular=unit(luminance(inputs.color("Specular"))),
        emission=inputs.color("Emissive Color"),
        alpha=grey(1.0 - inputs.unit("Transparency")),
    )


def _emission(source: Source, evaluator: Evaluator) -> Surface:
    return Surface(emission=_emitted(_Inputs(source, evaluator), "Color", "Strength"), weight=0.0)


def _transparent(source: Source, evaluator: Evaluator) -> Surface:
    inputs = _Inputs(source, evaluator)
    color = inputs.color("Color")
    if color != WHITE:
        evaluator.warn(inputs.node, "coloured transparency is not rendered yet; the surface is fully transparent")
    return Surface(alpha=NOTHING, weight=0.0)


def _holdout(source: Source, evaluator: Evaluator) -> Surface:
    evaluator.warn(source.node, "holdouts are not rendered yet; the surface is fully transparent")
    return Surface(alpha=NOTHING, weight=0.0)


def _unknown(source: Source, evaluator: Evaluator) -> Surface:
    color = next((entry for entry in source.node.inputs if entry.type == "RGBA"), None)
    if color is None:
        return Surface(base_color=grey(0.8))
    return Surface(base_color=evaluator.expression(color, source.groups))


def _mix(source: Source, evaluator: Evaluator) -> Surface:
    fraction_socket, *shaders = source.node.inputs[:3]
    first, second = (evaluate_surface(shader, source.groups, evaluator) for shader in shaders)
    fraction = evaluator.expression(fraction_socket, source.groups)
    masked = _masked(fraction, first, second)
    if masked is not None:
        return masked
    value = unit(as_value(evaluator.reduce(fraction, source.node, "the mix factor")))
    if value in {0.0, 1.0}:
        return second if value else first
    return _blend(first, second, value, source.node, evaluator)


def _masked(fraction: Expression, first: Surface, second: Surface) -> Surface | None:
    """A texture that mixes a surface with nothing is that surface's alpha."""
    if fraction.texture is None or fraction.factor != WHITE:
        return None
    if _is_nothing(first) and second.alpha == EVERYTHING:
        return replace(second, alpha=fraction)
    if _is_nothing(second) and first.alpha == EVERYTHING and fraction.component in _INVERSE:
        return replace(first, alpha=replace(fraction, component=_INVERSE[fraction.component]))
    return None


_INVERSE = {"ALPHA": "INVERTED_ALPHA", "INVERTED_ALPHA": "ALPHA"}


def _is_nothing(surface: Surface) -> bool:
    return surface.alpha == NOTHING and surface.emission == BLACK


def _blend(first: Surface, second: Surface, fraction: float, node: Node, evaluator: Evaluator) -> Surface:
    emission = per_channel(lambda a, b: a * (1.0 - fraction) + b * fraction, first.emission, second.emission)
    alphas = [_constant_alpha(surface, node, evaluator) for surface in (first, second)]
    alpha = alphas[0] * (1.0 - fraction) + alphas[1] * fraction
    shares = (alphas[0] * (1.0 - fraction) / alpha, alphas[1] * fraction / alpha) if alpha > 0.0 else (0.5, 0.5)
    blended = _weighted(first, second, shares, node, evaluator)
    return replace(blended, emission=emission, alpha=grey(alpha))


def _constant_alpha(surface: Surface, node: Node, evaluator: Evaluator) -> float:
    return unit(as_value(evaluator.reduce(surface.alpha, node, "alpha within a mix")))


def _weighted(
    first: Surface, second: Surface, shares: tuple[float, float], node: Node, evaluator: Evaluator
) -> Surface:
    """Reflection of two surfaces, each with its share; their emission and alpha are the caller's."""
    weights = shares[0] * first.weight, shares[1] * second.weight
    total = weights[0] + weights[1]
    if total == 0.0:
        return replace(first, base_color=NOTHING, specular=0.0, weight=0.0)
    parts = weights[0] / total, weights[1] / total
    averaged = "metallic", "roughness", "diffuse_roughness"
    if min(weights) > 0.0 and any(getattr(first, name) != getattr(second, name) for name in averaged):
        evaluator.warn(node, "shaders are not mixed exactly; one surface with their averages is shown")

    def average(name: str) -> float:
        return getattr(first, name) * parts[0] + getattr(second, name) * parts[1]

    return Surface(
        base_color=_mixed_color(first, second, weights, node, evaluator),
        metallic=average("metallic"),
        roughness=average("roughness"),
        diffuse_roughness=average("diffuse_roughness"),
        specular=average("specular") * total,
        weight=total,
    )


def _mixed_color(
    first: Surface, second: Surface, weights: tuple[float, float], node: Node, evaluator: Evaluator
) -> Expression:
    scaled = [surface.base_color.scaled(w) for surface, w in zip((first, second), weights, strict=True)]
    if scaled[0].is_constant and scaled[1].is_constant:
        return Expression(per_channel(add, scaled[0].factor, scaled[1].factor))
    textured = [color for color in scaled if not color.is_constant and color.factor != BLACK]
    kept = max(textured or scaled, key=lambda color: luminance(color.factor))
    if all(color.factor != BLACK for color in scaled):
        evaluator.warn(node, "a mix with textures is not rendered exactly; one texture alone is shown")
        return kept.scaled(sum(weights) / (weights[0] if kept is scaled[0] else weights[1]))
    return kept


def _add(source: Source, evaluator: Evaluator) -> Surface:
    first, second = (evaluate_surface(shader, source.groups, evaluator) for shader in source.node.inputs[:2])
    emission = per_channel(add, first.emission, second.emission)
    if first.weight == 0.0 or second.weight == 0.0:
        kept = second if first.weight == 0.0 else first
        if _is_nothing(first) or _is_nothing(second):
            evaluator.warn(source.node, "additive transparency is not rendered yet; the surface is shown opaque")
        return replace(kept, emission=emission, alpha=kept.alpha if kept.weight else EVERYTHING)
    evaluator.warn(source.node, "added shaders are not rendered exactly; one surface with their averages is shown")
    blended = _weighted(first, second, (0.5, 0.5), source.node, evaluator)
    base_color = blended.base_color.scaled(2.0)
    clamped = replace(base_color, factor=per_channel(lambda value: min(value, 1.0), base_color.factor))
    return replace(blended, base_color=clamped, specular=min(blended.specular * 2.0, 1.0), emission=emission)


_READERS: dict[str, Callable[[Source, Evaluator], Surface]] = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfTranslucent": _like_diffuse,
    "ShaderNodeSubsurfaceScattering": _like_diffuse,
    "ShaderNodeBsdfSheen": _like_diffuse,
    "ShaderNodeBsdfToon": _like_diffuse,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfGlossy": _glossy,
    "ShaderNodeBsdfMetallic": _glossy,
    "ShaderNodeBsdfGlass": _glass,
    "ShaderNodeBsdfRefraction": _glass,
    "ShaderNodeEeveeSpecular": _specular,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBackground": _emission,
    "ShaderNodeBsdfTransparent": _transparent,
    "ShaderNodeHoldout": _holdout,
    "ShaderNodeMixShader": _mix,
    "ShaderNodeAddShader": _add,
}
