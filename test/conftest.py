# SPDX-License-Identifier: Apache-2.0
"""What holds for all tests: compiling, or a machine that is held up, is no failure."""

from hypothesis import HealthCheck, settings

settings.register_profile(
    'any machine', deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile('any machine')
