"""Files with one fault: a module or a package a folder of conformance/vectors/invalid."""

from tools.vectors.invalid import (
    best,
    fast,
    lossless,
    lsdt_clip,
    lsdt_frame,
    mrdwt,
    online,
    parts,
    pca,
    pca_rdo,
    posewave,
    qbc,
    raw,
    recovery,
    shared,
    sources,
)

MODULES = (
    shared,
    parts,
    recovery,
    raw,
    lossless,
    mrdwt,
    qbc,
    pca,
    best,
    lsdt_frame,
    lsdt_clip,
    pca_rdo,
    online,
    posewave,
    fast,
    sources,
)
