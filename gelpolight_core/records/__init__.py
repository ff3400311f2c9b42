"""The lab's records: what was measured with which sensor, when and by whom."""
