"""Files -> files, stored bytes copied: cut, replaced, appended to, packed and unpacked.

Modules of protection and repair, here and in other folders:

    rewriting.py                        ``protect``: adds recovery data to a file
    appending.py                        computes recovery data and appends them
    repair.py                           ``repair``: plans the new file, reports what is lost
    recovering.py                       restores damaged bytes from recovery data
    salvage_copier.py                   copies the intact parts of a damaged file
    ../../container/chunk_repair.py     restores chunks from their copies and the index
    ../../container/tolerant_parser.py  parses live streams with lost or damaged parts
    ../../container/recovery/           the erasure code and the layout of its blocks
    ../reading/segment_salvage.py       decodes the intact segments of a damaged signal
    ../reading/lost_skeletons.py        rebuilds lost skeletons from stored source files
"""
