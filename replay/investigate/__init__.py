"""The closed loop: diagnose, choose the most informative experiment, run it, and repeat until a reason to stop."""
