"""The one exception a user's mistake raises; everything else that goes wrong in a run is an Outcome."""


class UserError(Exception):
    """A mistake in what the user gave: one line that names the place, what was given and what is valid.

    The command line prints the message and exits with code 2.
    """
