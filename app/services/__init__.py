"""What every page of the window uses: settings, log, messages, background jobs."""
