// SPDX-License-Identifier: GPL-3.0-or-later
// The composite of Mara et al. 2016, "Deep G-Buffers for Stable Global Illumination Approximation". It is not
// energy-correct: ambient obscurance darkens direct and indirect light, and few senders stand for the hemisphere.

#include "common/obscurance.glsl"

// The authors look for ambient obscurance within 0.75 m where they look for radiosity within 1 m.
const float OBSCURANCE_SHARE = 0.75;

/** What obscurance leaves of light, 0.05…1. */
float paper_accessibility(Obscurance found)
{
    float open = max(0.0, 1.0 - sqrt(PI * found.mean));
    return 0.95 * mix(1.0, open, found.weight) + 0.05;
}

/** What it leaves of direct light. */
float paper_direct_factor(Obscurance found)
{
    return mix(1.0, paper_accessibility(found), 0.65);
}
