# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
class WorldSampler:
    def __init__(self, world): self.r=np.array(world.radiance)
    def directions(self, points):
        z=1-2*points[:,0]; s=np.sqrt(1-z*z); a=2*np.pi*points[:,1]
        d=np.stack([s*np.cos(a),s*np.sin(a),z],-1)
        return d, np.broadcast_to(self.r*4*np.pi,(len(d),3)).copy()
