"""The commands of ``gelpolight``."""
