# SPDX-License-Identifier: GPL-3.0-or-later
"""The radiance grid: cells in world space that hold the surfaces in them and the light these send."""
