"""What a closed loop leaves: page, tables, models, and predictions from them."""
