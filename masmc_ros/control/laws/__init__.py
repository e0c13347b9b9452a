# SPDX-License-Identifier: Apache-2.0
"""Control laws, one file each: how the parameter estimate moves, and what else sets one apart.

All share tau = Y theta_hat + J' u of (15) and (17), with the reaching term u.
"""
