//! Notes on incoming directions that are too sparse for a lobe.

crate::declare_notes! {
    /// Notes (warnings in reports) on incoming directions that are too sparse for a lobe.
    IncidenceNote {
        Warning LightMoved { light_percent: f64 } =>
            "incoming directions are too sparse for the lobe: between measured ones about {light_percent:.0} % of its \
             light is expected in the wrong direction";
        Warning ErrorBetween { expected_percent: f64, promised_percent: f64 } =>
            "incoming directions are too sparse for the lobe: expect er(L2) of about {expected_percent:.1} % between the \
             measured ones, and {promised_percent:.2} % at them";
    }
}
