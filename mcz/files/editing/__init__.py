"""Files -> files, stored bytes copied: cut, replaced, appended to, packed and unpacked."""
