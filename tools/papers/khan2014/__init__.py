"""Khan 2014 and Khan 2017: QBC, DWT, AWT and PCA."""
