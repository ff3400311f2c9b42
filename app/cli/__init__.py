"""The commands of ``gelpolight``, one class each, with options, inputs and terminal output."""
