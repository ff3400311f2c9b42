"""Sizes of pressed objects: fits of indenters, profiles, roughness, and the measuring tools."""
