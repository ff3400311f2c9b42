"""Files of any content: atomic writes, locks, arrays, growing files, checked reading."""
