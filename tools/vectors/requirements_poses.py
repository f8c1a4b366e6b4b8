"""The vectors of the rules of posewave and of its parts."""

from __future__ import annotations

_ALL = "valid/posewave/*"

VECTORS: dict[str, tuple[str, ...]] = {
    "ROWS-03": (_ALL,),
}

ARGUED: dict[str, str] = {
    "PWAVE-31": "A rule for who goes on after a loss; shown by "
    "tests/codecs/test_contract_live.py::test_after_a_loss_no_frame_is_wrong",
}
