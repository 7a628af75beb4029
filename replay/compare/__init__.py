"""A recording beside the model's prediction of it: gathered, predicted, compared, judged."""
