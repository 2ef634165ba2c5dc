# Copyright 2026 fam_bundle_ros contributors
# SPDX-License-Identifier: Apache-2.0
"""The one error that says "your input is wrong", shared by every layer."""


class InputError(ValueError):
    """
    Bad input from a user: a file, a parameter, a command-line value.

    The message is one sentence that names the file, row or parameter and what was expected.
    The command line prints it and exits with status 2.
    """
