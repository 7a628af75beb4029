"""The demo's parts: what its twin conceals, the runs it is driven through, the film of them."""
