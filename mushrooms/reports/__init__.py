"""The HTML pages of the commands, and the data behind them."""
