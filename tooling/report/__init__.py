# SPDX-License-Identifier: GPL-3.0-or-later
"""`build.py report`: what is to be measured, the measurements on disk, and the page made of them.

Runs inside the development environment (numpy, FLIP, matplotlib), never inside Blender.
"""
