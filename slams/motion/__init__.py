"""Motion: what is known of the robot's next step before its scan is looked at.

The model is `slams.motion.model`: wheels, gyro and the motion so far, fused, with a covariance.
`Motion` as exported here is the plain predictor that came before it (`slams.motion.last`).
"""

from slams.motion.last import FADING, LONGEST, MEMORY, Motion

__all__ = ["FADING", "LONGEST", "MEMORY", "Motion"]
