"""Other people's data against a scene: files to named columns, columns to channels, and the verdict on them."""
