"""Reports that the Tools menu opens: a table that is made in the background."""
