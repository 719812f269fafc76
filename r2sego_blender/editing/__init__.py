"""What people correct by hand: the world frame, the proxy, objects, the robot.

Uses ``refine`` and what that stands on. A file is what a command or a button does.
"""
