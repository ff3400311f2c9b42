"""What every page is given: settings, jobs, messages, workspace and context."""
