"""How far a prediction is from a measurement, as several figures, since no single one is enough."""

from straw.replay.metrics.signal import Metrics, metrics_of

__all__ = ["Metrics", "metrics_of"]
