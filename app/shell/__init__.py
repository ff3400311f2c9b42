"""The main window: navigation, menus, dialogs and internal errors."""
