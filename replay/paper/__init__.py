"""The paper once more: its validation runs, numbers and figures, recomputed by the model."""
