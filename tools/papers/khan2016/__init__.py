"""Khan 2016: MRDWT beside QBC."""
