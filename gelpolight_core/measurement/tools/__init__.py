"""The measuring tools. Each is one class: geometry, fit, texts and palette entry.

A new tool is a new module in this folder. The Measure page, the library and Help find it there.
"""
