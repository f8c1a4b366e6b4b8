"""Linear transforms that several codecs share."""
