"""The main window: pages, menus, Start page, preferences, documentation and error messages."""
