"""The step `top_pose` of the wizard."""
