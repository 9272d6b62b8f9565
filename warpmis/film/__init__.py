"""The picture in the making, on the host: sums of samples per pixel, and how far a picture is from the right one."""
