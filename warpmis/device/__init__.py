"""The scene in Warp's memory: the structs that kernels read, and the upload that fills them."""
