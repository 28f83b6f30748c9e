// The replay of page.html, whose other scripts are no modules.

import { ReplayPlace } from "./replay_place.js";

window.ReplayPlace = ReplayPlace;
