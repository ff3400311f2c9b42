"""Services for every page of the window: settings, log, messages, background jobs."""
