//! Notes on incoming directions that are too sparse for a lobe.

crate::declare_notes! {
    /// Notes (warnings in reports) on incoming directions that are too sparse for a lobe.
    IncidenceNote {
        Warning LightMoved { light_percent: f64 } =>
            "incoming directions are too sparse for the lobe: between them about {light_percent:.0} % of its light is \
             expected in the wrong place";
        Warning ErrorBetween { expected_percent: f64, promised_percent: f64 } =>
            "incoming directions are too sparse for the lobe: between them er(L2) is expected to be about \
             {expected_percent:.1} %, at them it is {promised_percent:.2} %";
    }
}
