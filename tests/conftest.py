"""Settings of all tests."""

import os

from hypothesis import settings

# A clean checkout's verdict must not depend on the day: there Hypothesis draws the same examples each time.
settings.register_profile("same-examples", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("same-examples")
