"""The measuring tools. Each is one class: its geometry, its fit and its entry on the palette.

A new tool is a new module in this folder. The Measure page, the library and Help find it there.
"""
