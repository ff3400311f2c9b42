"""What every page gets in its context: settings, jobs, messages, workspace and cameras."""
