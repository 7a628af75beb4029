"""An apparatus of another hand: a straw of 36 coordinates, its campaigns and the effects concealed in them."""
