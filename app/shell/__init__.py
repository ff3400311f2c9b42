"""The main window and what all pages share: theme, status, messages, log and preferences."""
