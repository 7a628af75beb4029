"""The paper's validation runs, numbers and figures, recomputed by the model."""
