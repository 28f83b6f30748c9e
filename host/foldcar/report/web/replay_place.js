// Where the chosen run is shown as it moved.

export class ReplayPlace {
  constructor(element, model) { Object.assign(this, { element, model }); }
  show() {}
}
