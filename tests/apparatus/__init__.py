"""An independent apparatus: a straw of 36 coordinates, its campaigns and the effects concealed in them."""
