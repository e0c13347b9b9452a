# SPDX-License-Identifier: Apache-2.0
"""What the middleware needs to be told, and ways round what it does.

Each file says why it is there, and with it when it can go.
"""
