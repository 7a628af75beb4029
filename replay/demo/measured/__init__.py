"""A measured recording of another laboratory, with the base model of what was measured: `straw demo --measured`."""
