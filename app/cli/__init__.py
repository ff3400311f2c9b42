"""``gelpolight`` and its commands: options, inputs, terminal, and one class for each command."""
