"""The atlas of the linear theory: its curves, modes, maps and tables as exhibits."""
