"""What a model may lack: effects of the simulator, the image, the series, and their tolerances."""
