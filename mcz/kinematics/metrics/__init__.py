"""Error metrics of decoded motions: channels, points, markers, shell, contacts.

docs/reference/measures.md defines every id. Figures are sums of binary64 in no fixed order: they
agree between machines to about 1e-9, not to the last bit.
"""

from __future__ import annotations

from mcz.kinematics.metrics.comparison import compare
from mcz.kinematics.metrics.figures import Comparison, ContactSlide, JointFigures, Sliding

__all__ = ["Comparison", "ContactSlide", "JointFigures", "Sliding", "compare"]
