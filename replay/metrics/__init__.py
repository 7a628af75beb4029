"""How far a prediction is from a measurement; no single number says it, so several are kept together."""

from straw.replay.metrics.signal import Metrics, metrics_of

__all__ = ["Metrics", "metrics_of"]
