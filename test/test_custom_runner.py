"""PlatformIO's Unity runner without its download: platformio.local.ini selects it where Unity is seeded."""

from platformio.test.runners.unity import UnityTestRunner


class CustomTestRunner(UnityTestRunner):
    """Takes Unity from the core folder's lib/Unity instead of PlatformIO's registry."""

    EXTRA_LIB_DEPS = None
