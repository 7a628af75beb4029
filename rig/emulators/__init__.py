"""One file per emulated controller: the wire grammar of a device, on any plant that has a pressure."""
