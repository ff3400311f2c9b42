"""The main window, its start page and menus."""
