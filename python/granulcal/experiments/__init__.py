"""Studies on measured data; `granulcal reproduce NAME` repeats them."""
