"""The `gelpolight` command."""
