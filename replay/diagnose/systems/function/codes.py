"""Codes of a law in the kernel: where it acts, and over what."""

#: Places of a law. Columns of a law's row of integers: place, its number, state, its number, shape, first parameter,
#: number of parameters, number of its lagging state or -1.
RATE, FACTOR, CHANNEL, CLOCK, DELAY, STRENGTH, INPUT, SHIFT, ALONG = range(9)
#: States of a law, as in its row.
OF_STATE, OF_RATE, OF_INPUT, OF_TIME, OF_NOTHING, OF_SHOWN, OF_SPEED = range(7)
