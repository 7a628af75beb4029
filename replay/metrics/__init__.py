"""Distance of a prediction from a measurement, by several figures, since no single one is sufficient."""

from straw.replay.metrics.signal import Metrics, metrics_of

__all__ = ["Metrics", "metrics_of"]
