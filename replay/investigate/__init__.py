"""The closed loop: diagnose, choose the experiment that tells most, run it, again, until a reason to stop."""
